"""The half-twisting somersault (Trewartha, Yeadon & Knight, Table 1 and Fig. 4).

Begin with `table1`; `scene` is the somersault and who films it.
"""
