"""What decides: every threshold of a question once, with its unit and where it comes from.

"Derived" follows from a formula. "Convention" is what a field, or this package, has agreed on; near values would do as
well. "Tuned" was set by the experiment that is named. `tests/test_thresholds.py` makes each of the latter two half and
twice as large, under which no value of an ordinary fit moves by more than a small part of its standard error.

Thresholds of a single place that no other shares stand there: those by which segmentation reads a decay, and what
rounding and step lengths ask of an algorithm.
"""

# Does the model describe the run? Residuals in units of the noise, stated or seen in the record.
NOTICED = 3.0
"""From which on they are reported. Convention: noise alone is not as large in any record."""
DESCRIBED = 10.0
"""Up to which a fit has converged. Convention: what larger ones hold is no longer noise but motion."""
EXCESS = 2.0
"""The same squared, chi^2 per sample, or of one law over that of another: from which on a number of half-cycles may be
wrong, a law is fitted again from the best one's coefficients, and no law of a comparison describes its runs.
Convention; ten thousand samples of white noise exceed 1.05 once in a thousand records."""

# Is an effect there, or is it chance? Standard errors.
SUSPECTED = 3.0
"""From which on a sentence or a further term is worth it. Convention (GUM, G.1.3): chance reaches it in 3 of 1000."""
SURE = 5.0
"""From which on noise counts as other than white and of the size stated, and methods as contradicting each other.
Convention: each fit asks some ten such questions, of which one in a thousand would come out wrong at 4."""
EXTREME = 6.0
"""The same for the largest of many samples. Derived: of a million of white noise one in 500 records has one beyond."""

# Which of two descriptions? Twice the logarithm of their odds.
BARE_MENTION = 2.0
"""Below which they are equally good. Convention: Kass and Raftery, J. Am. Stat. Assoc. 90, 773 (1995)."""
VERY_STRONG = 10.0
"""From which on noise has a colour, a drift or a hum, and a model lacks a force. Convention, as above: one in some
hundred records of white noise is called coloured."""
DECISIVE = 12.0
"""From which on another number of half-cycles is excluded: odds of 400 to 1. Tuned: experiments/honesty/run.py."""
POSSIBLE = 0.01
"""Probability of another number of half-cycles from which on it is reported. Convention."""

# By chance, how often? Probability of a false alarm, of a test or of all runs together.
RARE = 1e-3
"""Of tests of the residuals, and for runs to be set aside as outliers. Convention."""

# Is the numerical error small? Standard errors of the noise.
ACCURATE = 0.1
"""Up to which nothing is computed once more. Convention: it adds half a percent to a standard error."""

# Does the record determine a coefficient? Its standard error over its value.
POORLY = 0.5
"""From which on that is doubted. Convention: its 95 % interval holds zero."""

# Is a value possible?
LARGEST_MU = 2.0
"""Largest coefficient of friction [1]. Convention: clean metals in vacuum and soft rubber come to one or two."""
