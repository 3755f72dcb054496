"""Joint sets by statistics, and the statistics of joint networks."""
