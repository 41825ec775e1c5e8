// Which ensembles are looked at at a fast pace, and how they are asked for.
import { type Sweep, isOver } from "../api";

/** Whether runs of an ensemble are being solved, or wait for it. */
export const isBusy = (sweep: Pick<Sweep, "state">): boolean => !isOver(sweep.state) && sweep.state !== "paused";

/** Up to `most` ensembles that are under way: first the one that is open, then what is being solved, then what waits. */
export function busiest<S extends Pick<Sweep, "id" | "state">>(known: S[], open: string | undefined, most: number): S[] {
  const rank = (s: S): number => (s.id === open ? 0 : s.state === "queued" ? 2 : 1);
  const once = [...new Map(known.filter(isBusy).map((s) => [s.id, s])).values()];
  return once.sort((a, b) => rank(a) - rank(b)).slice(0, most);
}

/** The filter that lets through these and no others. */
export const idFilter = (ids: string[]): string => ids.map((id) => `id = "${id}"`).join(" or ");

/** A list with newer versions of some of its members in their places. */
export function replaced<S extends { id: string }>(list: S[], newer: S[]): S[] {
  const byId = new Map(newer.map((s) => [s.id, s]));
  return list.map((s) => byId.get(s.id) ?? s);
}
