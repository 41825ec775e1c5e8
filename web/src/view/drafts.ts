// Documents that were begun and not submitted, by what they began with, as long as the page is open.

export const drafts = new Map<string, string>();
