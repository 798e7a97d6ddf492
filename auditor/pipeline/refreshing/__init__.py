"""The refresh at night: which recordings are learnt from, what they teach, and whether it comes into force."""
