"""The product on one machine: a bench with a simulated board, and an office that watches it."""
