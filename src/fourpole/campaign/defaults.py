"""Standard uncertainties that are assumed where the campaign states none.

The entries of `core` assume nothing: `core.channelerrors.ChannelUncertainty` and `core.rig.Rig` have the default 0, and
their callers state the uncertainties.
"""

from math import pi

from fourpole.core import condition

#: Relative change of K* per kelvin [1/K].
TEMPERATURE_SENSITIVITY = condition.TEMPERATURE_SENSITIVITY
#: Relative standard uncertainty of a gain [1].
GAIN_STD = 0.01
#: Standard uncertainty of a phase [rad].
PHASE_STD = 0.5 * pi / 180.0
#: Relative standard uncertainty of a value of the rig [1].
RIG_STD = 0.02
#: Relative standard uncertainty of a K1 that tests.csv states without u(K1) [1].
K1_STD = 0.02
#: Relative standard uncertainty of an added mass [1]: its bolts and brackets, and the balance.
MASS_STD = 2e-3
#: Standard uncertainty of the delay of a channel where one card samples all channels at once [s].
SIMULTANEOUS_STD = 1e-5
#: Standard uncertainty of the low-cut of an IEPE supply [Hz], and of a stated low-cut [1].
IEPE_STD, LOW_CUT_STD = 0.3, 0.1
#: Standard uncertainty of what frame, foundation and guide of a moving rig add to its preload spring, over it [1].
SUPPORT_STD = 3e-3
#: Standard uncertainty of the dry friction of a guide of which nothing is stated [N].
FRICTION_STD = 1.0
#: Standard uncertainty of the compliance of a bench whose frame_stiffness is not stated [m/N].
FRAME_STD = 1e-8
#: The uncertainty of a mounting on the drive, over that of one on the specimen [1].
ON_DRIVE = 0.1
