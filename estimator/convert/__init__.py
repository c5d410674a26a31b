"""Bus messages to arrays, and what estimators say to bus messages: pure functions."""
