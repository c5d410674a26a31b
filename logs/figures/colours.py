"""Colours of lines on paper: Okabe and Ito's, told apart by all eyes."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
