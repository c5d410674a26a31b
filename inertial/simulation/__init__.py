"""Analytic motions and sensor models: the truth that estimators are judged by."""
