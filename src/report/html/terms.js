// An explanation opens below its word, or above where there is no room.
for (const button of document.querySelectorAll("[popovertarget]")) {
  button.addEventListener("click", () => {
    const meaning = document.getElementById(button.getAttribute("popovertarget"));
    const place = () => {
      const [word, box] = [button.getBoundingClientRect(), meaning.getBoundingClientRect()];
      const left = Math.max(12, Math.min(word.left, innerWidth - box.width - 12));
      const below = word.bottom + 6;
      const top = below + box.height < innerHeight ? below : Math.max(12, word.top - box.height - 6);
      meaning.style.cssText = `inset:auto;margin:0;left:${left}px;top:${top}px`;
    };
    requestAnimationFrame(place);
  });
}
