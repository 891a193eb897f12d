"""Whole numbers in words. Standard library alone."""

TEENS = "ten eleven twelve thirteen fourteen fifteen sixteen seventeen eighteen nineteen"
ONES = f"zero one two three four five six seven eight nine {TEENS}".split(" ")
TENS = ("twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety")
SCALES = ((10**9, "billion"), (10**6, "million"), (1000, "thousand"), (100, "hundred"))
MOST_DIGITS = 12  # of a number that is read as one; a longer one is read digit by digit


def number_words(digits: str) -> list[str]:
    """What one says for so many; one that begins with 0, as a code does, is read digit by digit."""
    if len(digits) > MOST_DIGITS or (len(digits) > 1 and digits[0] == "0"):
        return [ONES[int(digit)] for digit in digits]
    return counted(int(digits))


def counted(number: int) -> list[str]:
    """The words of a number below a million million."""
    if number < 20:
        return [ONES[number]]
    if number < 100:
        tens, left = divmod(number, 10)
        return [TENS[tens - 2], *([ONES[left]] if left else [])]
    size, name = next(scale for scale in SCALES if number >= scale[0])
    count, left = divmod(number, size)
    return [*counted(count), name, *(counted(left) if left else [])]
