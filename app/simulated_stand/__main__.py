"""`python -m app.simulated_stand OPTIONS`: the device process that `SimulatedStand` starts."""

import sys

from app.simulated_stand.process import main

if __name__ == "__main__":
    sys.exit(main())
