"""What tests of several rooms share: rigs, feeders, a running demo."""
