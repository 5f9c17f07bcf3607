"""The backend `compiled`: the algorithms of `dynx.rbd`, compiled by `dynx.simd` for one robot.

Large robots run in loops over their bodies (`table_loops`), whose code serves every robot. `parametric` has
kernels that take parameters of the robot as inputs; `step` compiles a robot with its controller or task.
"""
