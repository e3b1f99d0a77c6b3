"""`make bench`: how fast we are, always beside something else, in one run on one machine.

Every figure that counts is a ratio: of two medians it would depend on what else the machine did in between,
so both sides take turns and the ratio is formed turn by turn.
"""
