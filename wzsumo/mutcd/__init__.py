"""The Manual on Uniform Traffic Control Devices, Part 6, as code: WorkZone -> WorkZoneLayout."""
