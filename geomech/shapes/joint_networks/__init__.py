"""Statistical joint sets, and the statistics of joint networks."""
