"""Confidence levels of intervals, verdicts and claims; every other module takes its levels from here.

±u in a table is a standard uncertainty (about 68 %). Intervals hold 95 %. Limits that are multiples of a standard
uncertainty without a stated probability stand beside the rule that uses them, as in `core.joint.reconcile`.

U = k u with k = 2 is that of JCGM 100:2008, 6.2.1 and 6.3.3; an interval from draws is that of JCGM 101:2008, 7.7.
"""

#: Probability that an interval holds the value.
COVERAGE = 0.95

#: Coverage factor k of an expanded uncertainty U = k u: about 95 % of a normal distribution, and the word of reports.
COVERAGE_FACTOR = 2.0

#: Probabilities of the quantiles that describe a distribution from Monte Carlo: ends of the interval, and the median.
LEVELS = (0.025, 0.5, 0.975)
#: Standard uncertainties to either side of the mean that hold 95 % of a normal distribution.
NORMAL_95 = 1.959964
#: A model or a statement is rejected if the probability of a larger chi-square by noise alone is below this.
CHANCE = 1e-3
#: An effect is claimed if the probability of as large an effect by noise alone is below this: two standard
#: uncertainties of a normal distribution.
CLAIM_CHANCE = 0.0455
#: The same probability for all effects together, when several are searched for any that stands out.
SEARCH_CHANCE = 0.01
