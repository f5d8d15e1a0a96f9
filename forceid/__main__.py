"""`python -m forceid`: the command `forceid`."""

from forceid.cli.boundary.start import start

if __name__ == "__main__":
    start()
