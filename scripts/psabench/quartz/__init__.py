"""Studies of a production batch of quartz accelerometers: deformation of the sensing element, run-in.

`plate` has the article's equations (6) to (12), `element` the figures of a sensing element with their tolerances,
`deformation` the study of both; `batch` the law of a production batch, `deformation_page` and `deformation_plots`
the report.
"""
