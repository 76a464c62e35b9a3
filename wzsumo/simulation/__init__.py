"""WorkZoneLayout -> SUMO -> trace table. `connection.py` alone imports libsumo and traci."""
