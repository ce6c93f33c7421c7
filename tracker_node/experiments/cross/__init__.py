"""The wooden cross in interlaced video (Trewartha, Yeadon & Knight, Figs 3 and 7 to 10).

Begin with `experiment`.
"""
