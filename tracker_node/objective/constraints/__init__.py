"""What a body may not do, and what is expected of it before images are seen, as objectives.

Begin with `prior`; `collision` keeps parts apart, axes that drive each other are in `prior`, too.
"""
