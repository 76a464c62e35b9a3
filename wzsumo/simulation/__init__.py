"""WorkZoneLayout -> SUMO -> trace table. `session.py` alone imports libsumo."""
