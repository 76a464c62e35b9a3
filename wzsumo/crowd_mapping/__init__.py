"""Maps from the traces of vehicles. Two kinds: lanes with probabilities (`lane_structure`), and mixtures of places (`mixture`).

The lanes are found in three wings: `course` (what all traces share, and their lane changes), `hypotheses` (which lanes there
are and which are closed) and `closing` (where lanes end, and the road before the zone). `cleaning` makes traces usable.
"""
