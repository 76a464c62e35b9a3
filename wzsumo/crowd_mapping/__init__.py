"""Maps from the traces of vehicles. Two kinds: lanes with probabilities (`lanes`), and mixtures of places (`mixture`).

`cleaning` makes traces usable, `reference_line` finds the line that they follow, `map_before` is what is known beforehand.
"""
