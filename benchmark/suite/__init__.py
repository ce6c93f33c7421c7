"""The tests themselves: how long they take, and how many planted faults they notice."""
