"""What the documentation's site is made of beside its pages: reference, figures, mathematics.

Nothing here is part of the program. Reference pages are made from the code when the site is built,
so that they cannot fall behind it.
"""
