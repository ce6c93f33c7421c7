"""Faults that change nothing that could be seen, each with its reason: (file, line before, line after)."""

_WORKERS = "tracker_node/parallel.py"

EQUIVALENT: dict[tuple[str, str, str], str] = {
    (
        _WORKERS,
        "self._executor = ThreadPoolExecutor(threads - 1) if threads > 1 else None",
        "self._executor = ThreadPoolExecutor(threads) if threads > 1 else None",
    ): "A pool begins no more threads than it is given work, and never gets more than threads - 1 pieces at a time.",
    (
        _WORKERS,
        "if self._executor is None or len(items) < 2:",
        "if (len(items) < 2):",
    ): "Of one thread all items are its own, and nothing is left to be handed to a pool.",
    (
        "tracker_node/loaders/whole_file.py",
        "content = stream.read(limit + 1)",
        "content = stream.read(limit + 2)",
    ): "One byte more than the limit is refused, and so are two.",
    (
        "tracker_node/calibration/board/board.py",
        "refined = cv2.cornerSubPix(gray, near, (min(half, 11), min(half, 11)), (-1, -1), criteria)",
        "refined = cv2.cornerSubPix(gray, near, (min(half, 11), min(half, 11)), (-2, -1), criteria)",
    ): "OpenCV leaves nothing out in the middle where either of the two numbers is negative.",
    (
        "tracker_node/optimize/stepping.py",
        "if not (math.isfinite(f[0]) and math.isfinite(f[3]) and f[1] < f[0] and f[3] > f[2]):",
        "if not ((math.isfinite(f[0]) and (f[1] < f[0]) and (f[3] > f[2]))):",
    ): "An infinite score makes a slope infinite and the place no number, which lies between no two points.",
    (
        "tracker_node/optimize/stepping.py",
        "if not (math.isfinite(f[0]) and math.isfinite(f[3]) and f[1] < f[0] and f[3] > f[2]):",
        "if not ((math.isfinite(f[3]) and (f[1] < f[0]) and (f[3] > f[2]))):",
    ): "An infinite score makes a slope infinite and the place no number, which lies between no two points.",
}
