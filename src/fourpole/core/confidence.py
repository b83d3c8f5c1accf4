"""Confidence levels of intervals, verdicts and claims; no other module holds such a number.

±u in a table is a standard uncertainty (about 68 %). Intervals hold 95 %.
"""

#: Probabilities of the quantiles that stand for a distribution by draws: the ends of the 95 % interval, and the median.
LEVELS = (0.025, 0.5, 0.975)
#: Standard uncertainties to either side of the mean that hold 95 % of a normal distribution.
NORMAL_95 = 1.959964
#: A model, or data as stated, is rejected when chance exceeds its chi-square with a smaller probability than this.
CHANCE = 1e-3
#: An effect is claimed when chance gives as large an effect with a smaller probability: two standard uncertainties.
CLAIM_CHANCE = 0.0455
#: The same probability for all effects together, when several are searched for any that stands out.
SEARCH_CHANCE = 0.01
