"""A fleet of drawn units that fly with a satellite receiver: `psabench campaign koi` (docs/procedures/koi_fleet.md).

`classes`, `unit`, `receiver`, `routes`, `conditions` are the truth: they read nothing of the host's configuration.
`season` lets psabench.koi.host fly a unit flight after flight, `grade` compares with the truth, `work` fills the store,
`figures`, `claims`, `page` and `plots` show it; `linear` predicts the same from the filter's covariance.
"""
