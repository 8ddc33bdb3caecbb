// What a run has shown so far, from the notices of the stage server.

// {sites: Map site -> {micro, macro [s], settled}, failed: Set, friction: Map site -> {axis: {value, sigma}}}
export function results(notices, entry, limits = null) {
  // An engine waits until the axes have stayed in the window for `hold`; settling is the time before.
  const hold = limits ? limits.hold : 0, limit = limits ? limits.settling : null;
  let begin = 0;
  notices.forEach((n, k) => { if (n.kind === "phase" && n.data.id === entry) begin = k; });
  const sites = new Map(), failed = new Set(), passed = new Set(), friction = new Map();
  for (const { kind, data } of notices.slice(begin)) {
    if (kind === "settled" && data.site != null) {
      const found = sites.get(data.site) || {};
      const took = Math.max(0, data.duration - (data.settled ? hold : 0));
      sites.set(data.site, { ...found, [data.kind]: took, settled: data.settled });
      const misses = !data.settled || (data.kind === "micro" && limit != null && took > limit);
      if (misses) failed.add(data.site);
    } else if (kind === "friction" && data.site != null && data.accepted) {
      const [name] = Object.keys(data.figures).filter((key) => /coulomb|^Fc/i.test(key));
      if (name) friction.set(data.site, { ...friction.get(data.site), [data.axis]: { value: data.figures[name], sigma: data.sigma[name] } });
    } else if (kind === "segment_done" && data.site != null && limit != null && !failed.has(data.site)) passed.add(data.site);
  }
  return { sites, failed, passed, friction };
}
