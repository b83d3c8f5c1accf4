"""The 1982 paper: its claims with their words, its figures, and the models of its field.

Lower rooms know of this one by the names in four registries only: `models.families.NAMED`, `findings.list._FURTHER`,
`report.words.sentence._FURTHER` and `plot.catalogue.PAPER`. Without these lines the room can be taken out.
"""
