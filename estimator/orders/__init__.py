"""What a person may order of the estimator: calibration, wiring, GNSS outages."""
