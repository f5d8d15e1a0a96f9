"""From where on something counts as real, and not as chance: one number for each kind of claim."""

from __future__ import annotations

CHANCE = 0.01  # that a test doubts an honest record: one in a hundred is looked at in vain
DENIED = CHANCE * CHANCE  # that a test denies what an honest record says: one in ten thousand loses its `ok`
SIGMAS = 3.0  # standard errors beyond which a number is no error: one in 370
WILD = 5.0  # standard deviations that no sample of a record of a million has by chance
MEDIAN = 0.6745  # standard deviations that half of normal deviates exceed
OUTLIER = 4.0  # standard deviations that an innovation counts for at most: one wild sample is no load
TENTH = 0.1  # of a standard deviation: what adds in squares widens a claim by half a percent
NUMBER = 1.0  # log-likelihood that one more number to fit has to gain (Akaike)
PATIENCE = 7.0  # log-likelihood that something more in a record has to gain: e^7 times as likely
THOUSANDTH = 1e-3  # of a standard deviation: numbers as near as that are the same
WORSE = 1.1  # times an error or a claim: an rms of a hundred samples is known to 7 % itself
WHOLE = 0.99  # of a variance or of a square: all of it but a percent
QUANTILE = 1.959964  # of the normal distribution: 95 % lie within, both sides together
HANN = 18 / 35  # of the powers under a Hann window are as good as independent: (sum w^2)^2 / (n sum w^4)
LAGS = 10  # samples up to which what should be white is looked at for correlation
