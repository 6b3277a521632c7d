"""`python -m seamlog`."""

from seamlog.cli import main

main()
