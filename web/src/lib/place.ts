// Places of the page as fragments of its address.

/** A place of the page: `#/sweep/ID/laws?x=width_m`. */
export interface Place {
  /** Parts of the path. */
  path: string[];
  /** What a panel was told beyond its defaults. */
  query: Record<string, string>;
}

/** The place of an address's fragment. */
export function readPlace(fragment: string): Place {
  const [path = "", query = ""] = fragment.replace(/^#?\/?/, "").split(/\?(.*)/s);
  return {
    path: path.split("/").filter((part) => part !== "").map(decode),
    query: Object.fromEntries(new URLSearchParams(query)),
  };
}

/** The fragment of a place. */
export function writePlace(place: Place): string {
  const query = new URLSearchParams(place.query).toString();
  return `#/${place.path.map(encodeURIComponent).join("/")}${query ? `?${query}` : ""}`;
}

/** What goes along to every place: the unit of speeds, and what is listed. */
const ALONG = ["speed", "find"];

/** The part of a query that goes along. */
export const along = (query: Record<string, string>): Record<string, string> =>
  Object.fromEntries(Object.entries(query).filter(([name]) => ALONG.includes(name)));

/** A panel's query when one comes back to it from another panel: its own, of the runs that are looked at now. */
export function comingBack(own: Record<string, string> | undefined, now: Record<string, string>): Record<string, string> {
  const entries = Object.entries(own ?? {}).filter(([name]) => name !== "filter" && !ALONG.includes(name));
  const { filter } = now;
  return { ...Object.fromEntries(entries), ...(filter === undefined ? {} : { filter }) };
}

function decode(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
