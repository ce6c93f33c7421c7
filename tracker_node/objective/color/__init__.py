"""Color modality: a colored body drawn over images, compared pixel by pixel (Trewartha, Yeadon & Knight).

Begin with `score` (generate and test) and `alignment` (the same as least squares); `drawing` draws smooth shapes for both.
"""
