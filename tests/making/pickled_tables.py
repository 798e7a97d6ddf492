"""One small table of points as pandas of several versions pickled it, and tables as the pandas at hand does.

The table: x 0.5, 1.5, ...; y 0, 2, ...; z -1, 0, ...; i 0, 10, ...; d 0, 0, 1, 0. Those that end in "joined" are it as
it is after pandas.concat of the points of each LiDAR: the third and the fourth row change places, and i is float32.
"""

import base64
import pickle
import zlib

import numpy as np
import pandas as pd

_PACKED = {
    "0.25.3, protocol 4": (
        "eNp1U81uEzEQjstuWkorqNSK5kAFEj9pVa2o1EocKtJSBIIVQeqNQ7XyJm68kN1EXi80iEpwaKHCtw6H9MSb8BiIG4/QIzcYe70oCcHS7u"
        "cZz3jm88y8d75MOiWz1FyXJk2aeo2OYN6+oDEDdfEhlfSR2Z/C8gc4hKpygyYqQS0N2keJZCKh7dSLaUJbTKSgZh60O41Xz3I596/u4QWL"
        "w45NdsBSL6QpxpsOEvYmeKJ16MAvKbfY68hOHnghyeJuL3ePs7aMqBC0h/ECwRqdJJUia0h0Ua4xBDWJ4YzJKfilI9ghIXyEXaj6xC8fAV"
        "9QblP2upqimnh+D04+5acXFHkH9Xr96W9c5ufXJIQnmgM5AEXwavIWvwg/iV8TGJ4rJ9HvVc+O8RY+qyrj6AqatDTfXY0DHPmqco0NZp9K"
        "KiRmrJxUdrrgO3rDcEPM1Qzz4PP8qqbEKwUh13eOgS+pif0hIpsjREqayM7XvPQ/azn+suhs5Thj8e+y8hWLixbPvw2bndeG7Yt108rrFu"
        "9vnfUr1z5vfN8+67+w2Lf4wyBgmv9yJAXHaIAj3x7H8PoIgxIZkXUE85Kz/LJ+/7kxT4rCDV11fovf5nd4lS/rOvPVosT/9STWk6/QAQd2"
        "CKp811tb99bytqbYEcCnVTnUA5MChtL68mvazvTJppqKWyLAQ5yqqTCLsOeTVHdIO2ow09VYd6KjZjqTiD/mL3mMurLVsiw1nRlgn+NU6z"
        "kqJjyImaRmsPYgC70/QzBj8w=="
    ),
    "0.25.3, joined": (
        "eNqVVE9r1EAU39lN1lpbbMFii1jqQd2KBAurWBG2tUWowRXEi4cSJtlpJ7jJLvmjXbG4Hlqtzq3PQ3vym/gtFG9+hB696ZvJLGRranFg8s"
        "vMvD+/9+a96RufvxklNcRkl4YtGlteJ2LWRkQDBuLsKk3oQ/W/D/PvYBtqwnRauAliNi/vhwmLQtqOrYCGdJNFMYixB+2O9+Jxts70a+to"
        "YHpYscW2WGy5NEZ/o07IXjlrcg8V+DlhDv6lZyNzPBWmQbeXqQdpO/FpFNEe+nMi5nXCOIlSL0EVYSpBEGfQnRLZB7u0AyvEhffwFGo2sa"
        "s7wKeE2Up6XRmiKD+5C3sfstOKIG+g2Ww++o1DfexGAu6ejIFsgSBomrzG6eNMcLaA4bkwQpmvZrqLVvi4uFQULjJjke9hxGthcqeei5JP"
        "8gv8ouTJZwYsDVzMirI/xO3+MW4lyW1lrqQH0VjRWNYIKMZvClMxAUWSYUQFTm1jV7ndyLnl94qc9jPTPxsZ/tI4tpShsVQaHno9rXFC49"
        "HXYrmjxuHBzOVPt78vHx481/hD44FCFdRfERAVwWIuKccHySflBH2ZgfppGZjI7MwtI1ucXxQjlddxfv4ft3pFVhO/yq/x63yeqasZFM6J"
        "ekTr8Rv0PxVqeQW2DaJ6y1qoWwtZd1EsTOCjourKvo0Bmcn96kvaTuXJqhgJNiMHD3FRGM1iQf0N6s7IpTqVRN/yJu+LETf1sYVDfC/MuO"
        "17sgtt067aRBrWgs94n3+0K1iS2S5LY9VoDrYtPlLyWRg8WE7AEqreiXVIXesPIkKh5A=="
    ),
    "1.2.5, protocol 2": (
        "eNp1VG1z00YQloNjQFCgb0DaBgINVLTUEAg0pYADpbSgYtrrm2jripN08Rlk2Y/uBKSDZuBDEjL8AIZ+6k/gW/utM/YPo3cneSbmZT9od2"
        "/3Hu09t3sPJsI+TSIq6mEvZfWllHaZfYlKetlYsI48RCXHhONVLcvyu+0Um8Z2dBLJ0oTGot6lCW2zVNgX4154+1rh2agqhEmnhZrzwr6I"
        "3WOiHlDBbD9hd/0resXG5tenlRlbcmwt6olUobDDJOv2l4v8bhbLDk1Tumz7KQt7iZBpFkob24osW0GbKLa71greCP2wF7FQ2CzRho0dXk"
        "UBB9jp1ZSOqewkc9i1ijcJ3lrD2wTvOG7Fra3g3RIwkst9tW+3N6Hyry9gz/qjNewlmHLcTQbrPt5rNptXnysxH7ch8X6w3sIHjonfw7TR"
        "y9hn9J/Yb3QHM0ZLHDA6wkEm8WFgTp6o28FsM1vFIYLD/NWkpTRpM5vob0ndRzkch896kxpfL+GIsYWkqcTHrmXAhez18YlbLR3Wx1G3on"
        "71KUGdtXDM4du4oe84V5zMEZzQnEy61VWc5AURSwuY10ScIjg9IuIsPhsnQh1tIVjnO7x/rJEM/26Uxr+lUV0s9PZFa1xKf1ep95Z6+Gzw"
        "33ji8FljfMtIZkt/vtTnFwd/DZ5OTQ8enxo+uaDtGxvswdMNznDk4HOuuuMMwRcSZ4MRMec0MecJGpqYiiZmsSSms4ALmpiLBF8qYvjLlF"
        "wylMxYL0vlBR9f6X9fJvha4ptA3cwVh2/majyuOtweleLqUr4luGbuaAVNPqV677rDp/k+vp/P8AOqq74LuGmm7wlIAfHDBogfNcRPBD+b"
        "06zgFwPh8YNU4ka581eC31iO383YHK/Pzdfn0MrxRzGoVLUjfF4z0UC/DwI3W6BOjsAxi3donKmckJ/wtihXPTS+ShOIQt8Pso6a6sT3bR"
        "F3QjVszLVUu1XWsETQznJwh4e8wSPO1HJNBzoEtzKWCYnbxcD4akwRe1vLV8M8dOga3+8ySc1TkrTQM/NApUwF+jlgivOXYtoWSHMIb48O"
        "x3HvrvCjrK/qoZL5MQ1YLCAfiSyo/w/9BZPH"
    ),
    "1.2.5, protocol 5": (
        "eNp1U81rE0EUz9bdWPuBVixtDhYFP7ZSFgsVPBST2lLQxQi5eSjLbDLJrO5uwsysbcSCHlpbnFufhfTkf+KfId78E3r0pm9mN5CU+mD3vT"
        "fzvuf9PjnfGnbJkJrrkbRFhNfscuq1OUkoqGtbRJJtI5/A8mfYB1fZQdLhoJZGzaNUUp6SWHgJSUmHcgFq5nncbb57leu5u7uD/ovjji26"
        "R4UXEoHppoKU7gYv9Bk6sGnlDGWTuIXFgJpPs6TXz92TLJYR4Zz0MV/AabObCsmzpkQX5RhDUFcxnTE5Ab90AJtWCF+gAa5v+eUDYPPKac"
        "l+T3eoJl4/heOj/PaKsj5CvV5/+RfJ/PyqhPBY92DtgbIwtPUBvwg/iV8LKN4rO9XjqmeHGIXNqspl7XKSdnS/Dc1HemQryjE2WL2QhEus"
        "WNlCdnvg21qgKFgmNNV13ByZBYqUR01Q00Gbd5Mwa7fN3N3T76VR+l3N+Z+C27Wcz9RK41ToNwq+WPDzH+Nm59Vx+yHdK/S1gj+rnQ0qt7"
        "8++blxNnhT8EHBfxkObElNtMdeYP3CC5Rwwr7j24c4702QesTr7umd0uVkXdBNgmgkAdu4JLylw7MtWQyZzbLr+mnm2C22oBeIVYbr46By"
        "Vy8Eu88esIfMZct6BdjK8PX/62kVnuwRGXGg+6DKj73VNW8133iCywJsSpVDjSUBmEqfl9+TONM322oSwRjgJQJuMswihEMq9PLEUZOahc"
        "dpWTprpiuJWJ29ZQmelYtTmgmztAFCAPGuITbEfpBQSQzmdjAikRJRrQsM2jHpGHGBxHF3VwStrIf5iKRBTEIaCzgSWej9AzZBgOo="
    ),
    "1.5.3, protocol 4": (
        "eNptU89v0zAUbrqk/JoYEwI6CRBCHMYlJxAgIToYQoKITtqNw2Q5idtES9zIdrQVMQkOK5vwbY9Dd+KP4M6fgbjxJ+zIDZ6dFNoyS/b3nD"
        "w/f+/ze+/dz18XGnbo5YLymEo/Ggjm9wTNGehzz6miL6x9BHc/wB6sapfkfQH65rR7yhUTnGbSzymnfSYk6MVn2SDafl3t8bi+Wp8gWRrK"
        "f0dAL5GSF2m0nTESmjPG+Qov82JYRc/LTKVUCDrEqESwaMClEmWkjKNnHUGfwdjW5QiCxj6sOyF8hE1YDZzAC9wRJEvai9WwMJnoZu8hHB"
        "5U/xe08xi63e6r3zjsEjQUhIfrXyphfnYq/FWju1bhYo1/R72/VGO7xpNvs24nnVn/ybhT7+/V+GTteLxy49P970+Px29qHNf4wyIgTX02"
        "LFOUh6OOnszSiFkBMGfHpBc0zZpcSC4my0aW5PJEFMeK0tbNdEqK5PppQtyaS7ThzO0NkeQ23tmavnUEW1gu7dk6idkuk35IJVbXecLZDn"
        "lpviHp5IH2JratsxhrD/4n3tq3tDdmXvDd3At2DHFzvbML2sHycN7iTHEqnDEwI53LTWF3y5GR6JFeOY2poLxvqG4anKKXbGjP+hjZFRUK"
        "RdeuVIMCAtcYDA3HhmZmwbbB4sOOMllNuovkTFGb5haGoUph3+yBbpFeRvvWvEazbLAjSVwW+LZUMZLRkGHTHMgy9P8A/UtMnw=="
    ),
    "2.2.3, protocol 5": (
        "eNptU81u00AQtlM7/DSCUonSHKg4cAiXSAiQOCASKEICi1TqjUO1Wtvr2Kr/tF6rLaISHBpasTeGSumJN+EROCJuPEKP3GB27Qinyki736"
        "w9Mzvf7MwH++uPJUOLvJHT1KdF38s46wecJgzklRdU0Jda/wL3PsIh9KRFkjEHudE0j1LBeErjop/QlI4ZL0B2nseZt/umOqO7XKs9SBy5"
        "xX8XkNdJmeaRtxsz4iofZbyalkl+UEVHlfHIA7lMAp4lbhkEOmLv9JvRlN+DCv/UaA0r7AyNeanPKzWu13j+fd7sfDBvP5O79flhjU+HZ9"
        "Pu7c+Pfj47m76tcVrjL40gbc0H0RcHuaqmbAWP4eT4E2xDz1mS5hMYjUav/6LozTEEuI7tWBOQ5iYINJOX3TKKRZRiyewijjwVxjHQyFRR"
        "nJbaw+XwWu/0jrFYzAtnCFdlK2rkEa4tyMJUWYRdlUO4gde1mxdOYAebYn2+G3y2z4q+SwvsoaskZXvklfqG+Yb3pT3TdTf52GEgbzaeOy"
        "mRJOWcYrk6hDMvSwvBS08o9xV5CS/SPxX5I9g0XaiSN532kSa0NVfY9xcKO0BKJypncx9Li3eY73BFuAQuHxj+l1aqen5UThTnB7K7iB6n"
        "6Vjx21bY4BRuSVvbqGcSlAvMU1qFyHJwLKUwVEwdmqkNJwp7AodNlWI2eCRhgura7GAYKgSO1CHINgliOtbqLRrH2V5B/DLHXqCCkZi6DO"
        "fpuCjd/j/9rVSd"
    ),
    "2.2.3, joined": (
        "eNqNU01v1DAQ3ewmy1dFWyFgER+qOC1I5AQSB6SlFCFBxFaAOHCojJN411GTbJQ4ahdRCQ4trfCtw2F74p/wMxA3fkKP3GDseCGlRdSS/e"
        "xkPDPP8+ad/emm3dBDzmc0DWnhBqOcuYOcJgzkqYdU0Ed6vws33sMGdKVNkmEO8lrdPEoFy1MaF25CUzpkeQFy5kE8ClafVme83pUXzBUS"
        "R37x5w7IWVKmWRSsxoz46hJay/NpmWTjyn1SxiKieU7H6JbkLBilhcjLQChDRxuCPIG+tckueI1NWLJ8+ADPoetZXsuzt4DPSicU40xRkc"
        "3BXdjZrv63pHUP+v3+k5849OI1BPg7S6+rl/neq/CHwZn7FdoGfw9z7hicM7j/5Wi7/R5gGHnSLyOkl+I7OEUcBUwTwJwtlZ7XVCs/w8/y"
        "eUWLn5uSsjSpjmxGNSr8ylFEFhr/GJZBlQi/7jle+3hRL6PPvcmlqx/vfF3cm7wy+M3gRKPxaaPX4zIZ3P4fk7kq34VFfD6cn6dRsML1KA"
        "JWUG+dgxIN2TorXJ8WKOzTJGVr5LH6hs/Nl6Uz3WuJhyh7OJxoe1OnuXxAO2//0k5PJarCW+sgLRSm9QZnhFPgDIGpotup6ql+uaWe5Bl/"
        "gVH5y8MBbTzcqtVvWq+WwWa9fkPpaJKgvTK1YLOi4rGPFaFpT5OECaoZrqDkqBDYrRsg22QQ06HeXqRxPForSFhmKEgqGImpz7BTt4vSd3"
        "8BShJv8g=="
    ),
}
LAYOUTS = {name: zlib.decompress(base64.b64decode(packed)) for name, packed in _PACKED.items()}
"""The pickles by the version of pandas, and what is particular."""


def pickled(columns: dict[str, np.ndarray], protocol: int = 4) -> bytes:
    names = pd.Index(list(columns), dtype=object)  # as pandas up to 2 has them
    return pickle.dumps(pd.DataFrame(dict(enumerate(columns.values()))).set_axis(names, axis=1), protocol)
