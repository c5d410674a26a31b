"""TLS on the web port by itself: the certificate, and the first byte of every connection."""
