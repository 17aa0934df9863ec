"""What the checks of one file found."""


class Findings:
    def __init__(self):
        self.problems = []
        self.ratios = {}
        self.counts = {}

    def problem(self, check, text):
        self.problems.append(f"{check}: {text}")

    def ratio(self, check, value):
        self.ratios[check] = max(self.ratios.get(check, 0.0), float(value))

    def count(self, what, number=1):
        self.counts[what] = self.counts.get(what, 0) + int(number)


def some(points, most=3):
    text = ", ".join(str(tuple(int(x) for x in p)) for p in points[:most])
    return text + (f" and {len(points) - most} more" if len(points) > most else "")
