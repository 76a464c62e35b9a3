"""wzsumo: can an automated vehicle learn from the traces of the cars ahead where to drive through a work zone?"""

__version__ = "0.1.0"
