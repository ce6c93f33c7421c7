"""The half-twisting somersault (Trewartha, Yeadon & Knight, Table 1 and Figs 4 to 6).

Begin with `experiments`; `scene` is the somersault and who films it.
"""
