"""Single files of a bag: MCAP written without copies, and read whatever their condition.

Begin with `writer` and `recovery`.
"""
