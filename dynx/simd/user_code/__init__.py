"""Numbers and arrays that a user's own code gets when it is traced, with the functions of NumPy."""
