"""Learning from drives that nobody looked at: which of them seem clean, and whether what they teach may be trusted.

Whoever can put recordings among those that are learnt from can raise thresholds: little by little, by one vehicle, or
by many recordings of a day. So each drive is judged, and compared, by drives of other vehicles and days (`drives`,
`two_samples`); no drive, day, vehicle or place counts for much (`influence`); and thresholds may neither rise far at
once nor, in sum, far from what a person confirmed (`gate`).
"""
