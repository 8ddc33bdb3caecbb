"""The operator's web page: a process of its own, and a client of the stage server.

From the bottom: `folder` (files from a request), `access` (tokens, cookies, tickets, rates), `gate`
(what every request passes), `bodies` (JSON), `samples` (scope and its export), `link` (watches the
server), `recipes`, `archive` (runs, diagnoses, maps, reports), `jobs`, `server_process`, `session`
(one page's websocket), `context`, `records` and `app` (routes), `process`. The page is in
`static/`.
"""
