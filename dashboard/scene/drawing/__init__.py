"""Shapes, colours and charts: what is drawn, without a word of where the data come from."""
