"""JUDGE: disparity errors become an e vector, and that becomes attacked sensors. Pure and small."""
