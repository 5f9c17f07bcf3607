"""Thirty acceptance tasks of users: ten of a student, ten of a control engineer, ten of an RL researcher.

The student knows Python and little robotics. The control engineer knows PyBullet.
The researcher trains policies.

Protocol. The reader has the built site and an installed wheel with the extras `all` and `train`.
He has no source. He gets the text of one task at a time and may write any program.
Thirty tasks take six minutes each on average. Waiting for a training run counts.

    python -m tests.tasks list              numbers and titles
    python -m tests.tasks show 7            the text of task 7, with the files it gives
    python -m tests.tasks show 7 FOLDER     the same, and the given files are written to FOLDER
    python -m tests.tasks check 7 FOLDER    a line that says right (exit code 0) or what is wrong (1)

The checks compute each result without dynx: by closed forms, NumPy, Pinocchio, PyBullet or MuJoCo.
"Robot X of example-robot-data" means the file X of that package.
"""
