"""Dynamic reliability of high-speed EMS maglev trains on guideway bridges."""
