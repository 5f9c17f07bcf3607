"""The command line `dynx`: argument reading, tables, worker processes; no robotics of its own."""
