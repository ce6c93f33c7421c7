"""The half-twisting somersault (Trewartha, Yeadon & Knight, Table 1 and Fig. 4).

Begin with `scene`; `motion` is the somersault itself.
"""
