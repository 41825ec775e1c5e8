// Filters that buttons put together: terms joined by "and", each taken out again as it was put in.

/** A text as the filter language writes it. */
export const quoted = (text: string): string => `"${text.replaceAll('"', '""')}"`;

/** The parts of a filter between its outermost "and"s. */
export function terms(filter: string): string[] {
  const parts: string[] = [];
  let [part, depth] = ["", 0];
  const flush = (): void => {
    if (part.trim() !== "") parts.push(part.trim());
    part = "";
  };
  for (const token of filter.match(/"(?:[^"]|"")*"?|'(?:[^']|'')*'?|[()]|\s+|[^\s()"']+/g) ?? []) {
    if (token === "(") depth += 1;
    if (token === ")") depth -= 1;
    if (depth === 0 && token.toLowerCase() === "and") flush();
    else part += token;
  }
  flush();
  return parts;
}

/** Whether a filter has a term. */
export const hasTerm = (filter: string, term: string): boolean => terms(filter).includes(term);

/** The filter with a term, or without it if it has it. */
export function toggled(filter: string, term: string): string {
  if (hasTerm(filter, term)) return terms(filter).filter((t) => t !== term).join(" and ");
  if (filter.trim() === "") return term;
  return [...terms(filter).map(alone), term].join(" and ");
}

/** A term that "and" does not tear apart. */
function alone(term: string): string {
  const outside = term.replace(/"(?:[^"]|"")*"|'(?:[^']|'')*'/g, '""');
  let depth = 0;
  for (const token of outside.match(/[()]|[^\s()]+/g) ?? []) {
    if (token === "(") depth += 1;
    else if (token === ")") depth -= 1;
    else if (depth === 0 && token.toLowerCase() === "or") return `(${term})`;
  }
  return term;
}

/** A refused filter before, at and after the character that it is refused at, counted from 1. */
export function marked(text: string, character: number): [string, string, string] {
  const characters = [...text];
  const place = Math.min(character - 1, characters.length);
  return [characters.slice(0, place).join(""), characters[place] ?? " ", characters.slice(place + 1).join("")];
}
