"""The LPC1768 board in software: the exact image in the Unicorn CPU emulator, with models of what
surrounds it.
"""
