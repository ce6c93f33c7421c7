"""What a body may not do, and what is expected of it before images are seen, as objectives.

Begin with `prior`; `collision` keeps parts apart, `coupling` holds axes that drive each other.
"""
