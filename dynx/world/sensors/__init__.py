"""Sensors of scenes and simulations: what each measures of a motion, and its errors.

A reading is a function of the motion alone (`kinds`), followed by the errors of the instrument (`errors`). So
a world, the record of a simulation and a log give the same readings (`readings`), on every engine.
"""
