"""From a request to files: one avatar, or many at once.

    ExportRequest -> export_avatar | export_many -> files, report, manifest

The only room beside the commands that sees all three packages. Its names are `avatargen.ExportRequest`,
`avatargen.export_avatar` and `avatargen.export_many`.
"""

from avatargen.shadow import require_ours

require_ours()
