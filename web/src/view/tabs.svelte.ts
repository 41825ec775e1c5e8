// What each panel of each ensemble showed last, so that one finds it again when one comes back.
import { SvelteMap } from "svelte/reactivity";
import { comingBack } from "../lib/place";
import { route } from "./route.svelte";

const seen = new SvelteMap<string, Record<string, string>>();
const key = (id: string, panel: string): string => `${id} ${panel}`;

/** Remembers what a panel shows. */
export const remember = (id: string, panel: string, query: Record<string, string>): void => {
  seen.set(key(id, panel), query);
};

/** Address of a panel as it was left. */
export const tabHref = (id: string, panel: string): string =>
  route.href(["sweep", id, panel], comingBack(seen.get(key(id, panel)), route.query));
