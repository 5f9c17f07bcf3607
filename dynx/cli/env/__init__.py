"""``dynx env``: the tasks, and how far apart the engines are on one."""
