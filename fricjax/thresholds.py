"""Thresholds for decisions, each defined once with its unit and origin.

A "Derived" threshold follows from a formula. A "Convention" is a value on which the field, or this package, has agreed;
nearby values would serve equally well. A "Tuned" threshold was set by the named experiment. `tests/test_thresholds.py`
halves and doubles each convention and each tuned threshold, and checks that no value of an ordinary fit moves by more
than a small part of its standard error.

A threshold that only one module uses is defined in that module. Examples are the thresholds of segmentation, and the
limits for rounding and step lengths of an algorithm.
"""

# Does the model describe the run? Residuals in units of the noise, as stated or as estimated from the record.
NOTICED = 3.0
"""Larger residuals are reported. Convention: noise alone stays below this value in any record."""
DESCRIBED = 10.0
"""A fit with larger residuals does not describe its record. Convention: larger residuals are motion, not noise."""
EXCESS = 2.0
"""The same squared: chi^2 per sample, or the ratio of the chi^2 of two laws. Above it the number of half-cycles may be
wrong, a law is fitted again from the coefficients of the best law, and no law of a comparison describes its runs.
Below its inverse, a noise that was estimated from the record is replaced by the scatter of the residuals.
Convention: with ten thousand samples of white noise, chi^2 per sample exceeds 1.05 in one of a thousand records."""

# How much of the motion may stay unexplained? Slow residuals over the motion, each as a root mean square.
UNEXPLAINED = 0.01
"""A larger share is named in the status and in a warning. Convention."""
UNDESCRIBED = 0.05
"""A fit that leaves a larger share unexplained does not describe its record. Tuned: experiments/trials/run.py."""

# Is an effect there, or is it chance? Standard errors.
SUSPECTED = 3.0
"""A larger effect justifies a sentence or a further term. Convention (GUM, G.1.3): chance reaches it in 3 of 1000."""
SURE = 5.0
"""Above this value noise is not white or not of the stated size, or two methods contradict each other. Convention: each
fit asks about ten such questions; with a threshold of 4, one fit in a thousand would get a wrong answer."""
EXTREME = 6.0
"""The same for the largest of many samples. Derived: white noise exceeds it in one of 500 records of 10^6 samples."""

# Which of two descriptions? Twice the logarithm of their odds.
BARE_MENTION = 2.0
"""Below this value the two are equally good. Convention: Kass and Raftery, J. Am. Stat. Assoc. 90, 773 (1995)."""
VERY_STRONG = 10.0
"""Above this value the noise is coloured, drifts or hums, or a term is missing. Convention, as above: about one
in a hundred records of white noise is called coloured."""
DECISIVE = 12.0
"""Above this value an alternative number of half-cycles is excluded, with odds of 400 to 1.
Tuned: experiments/honesty/run.py."""
POSSIBLE = 0.01
"""An alternative number of half-cycles with a higher probability is reported. Convention."""

# How often by chance? Probability of a false alarm, for one test or for all runs together.
RARE = 1e-3
"""Significance level of residual tests and of the test for outlying runs. Convention."""

# Is the numerical error small? Standard errors of the noise.
ACCURATE = 0.1
"""A larger error makes the result be computed again. Convention: it adds half a percent to a standard error."""

# Does the record determine a coefficient? Its standard error over its value.
POORLY = 0.5
"""A coefficient with a larger relative error is doubtful. Convention: its 95 % interval contains zero."""

# Is a value possible?
LARGEST_MU = 2.0
"""Largest plausible friction coefficient [1]. Convention: clean metals in vacuum and soft rubber reach one or two."""
