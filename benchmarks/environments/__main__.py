"""Run `benchmarks.environments.speed`."""

from benchmarks.environments.speed import main

if __name__ == "__main__":
    main()
