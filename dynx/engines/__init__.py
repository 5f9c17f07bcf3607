"""Foreign engines, each imported in one file, which names the command that installs it in its error.

In the folder of an engine `library` imports the engine, `backend` and `stepper` implement the interfaces of
dynx, `as_loaded` loads a file as users of the engine do, and `native_queries` has the engine's own distances,
rays and pictures of a scene. `own` is dynx's own stepper, which moves a scene by any backend.
"""
