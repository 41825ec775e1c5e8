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

function decode(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
