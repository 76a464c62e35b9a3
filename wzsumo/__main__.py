"""`python -m wzsumo`."""

from wzsumo.cli import main

if __name__ == "__main__":
    main()
